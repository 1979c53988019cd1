"""Campaigns of the trials with their truths, for a diagnosis by another checkout."""

from __future__ import annotations

import shutil
from pathlib import Path

import msgspec
from trial_cases import PLAIN, write_campaign
from trial_plans import Plan
from trial_truth import truth_text

TRUTH = "truth.json"


class Made(msgspec.Struct, frozen=True):
    """One campaign to make, and the folder of all families."""

    plan: Plan
    folder: str


def make_case(order: Made) -> str:
    """Make the campaign of a case and its truth; one with a calibrated rig file also with the built-in one."""
    plan, folder = order.plan, Path(order.folder) / order.plan.family / f"{order.plan.number:04d}"
    if (folder / TRUTH).is_file():
        return plan.family
    folder.mkdir(parents=True, exist_ok=True)
    write_campaign(plan, folder)
    further = {}
    if plan.calibrated:
        plain = folder.with_name(f"{folder.name}-plain")
        plain.mkdir(exist_ok=True)
        for log in folder.glob("*.csv"):
            shutil.copy(log, plain)
        shutil.copy(folder / PLAIN, plain / "campaign.toml")
        (plain / TRUTH).write_text(truth_text(plan), encoding="utf-8")
        further["same_as"] = plain.name
    (folder / PLAIN).unlink(missing_ok=True)
    (folder / TRUTH).write_text(truth_text(plan, **further), encoding="utf-8")
    return plan.family
