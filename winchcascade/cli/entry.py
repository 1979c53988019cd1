"""The entry point: it runs the command that is given, and reports what goes wrong in one
sentence.
"""

from __future__ import annotations

import gc
import os
import sys

TYPE_CHECKING = False  # not from typing, as in the package's own file
if TYPE_CHECKING:
    from typing import NoReturn

_INTERRUPTED = 130
"""Exit code of an interrupt, by the custom of shells."""

_OBJECTS = 100_000
"""New objects after which Python searches for unused ones: imports make more, and searches among
them took a tenth of the time of a page. Arrays are freed at once, without a search."""


def run() -> None:
    """Run the command line in a process of its own: its end is not delayed by a search for unused
    objects, which takes a tenth of the time of `reduce`."""
    try:
        main()
    finally:
        gc.freeze()


def main() -> None:
    """Run the command line: a fault of the input is one sentence on stderr and exit code 2."""
    gc.set_threshold(_OBJECTS, 50, 100)
    try:
        import signal

        from winchcascade.core.process_end import end_on_signals

        end_on_signals(
            {signal.SIGINT: "winchcascade: interrupted", signal.SIGTERM: "winchcascade: ended"}
        )
        _ready_streams()
        from winchcascade.report.render.terminal import screen_of, use_screen

        use_screen(screen_of(sys.stdout))
        from winchcascade.cli.app import (
            command_line,
        )  # here, as it takes most of the start, which may be interrupted

        code = command_line(sys.argv[1] if len(sys.argv) > 1 else None)(standalone_mode=False)
        sys.stdout.flush()
        if code == _INTERRUPTED:
            raise KeyboardInterrupt
        sys.exit(code)
    except KeyboardInterrupt:
        _exit_interrupted()
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(2)
    except OSError as fault:
        if (
            fault.errno is None
        ):  # no error of the system: libraries derive some of their own from OSError
            raise
        where = "standard output" if fault.filename is None else str(fault.filename)[:200]
        if fault.filename is None:  # the rest of its buffer must not fail again at the end
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        _exit_with(
            f"{where}: cannot be used ({fault.strerror}); check the path, its permissions and the "
            f"space left."
        )
    except Exception as fault:
        _reject_usage(fault)


def _ready_streams() -> None:
    """Let no letter that a terminal lacks, and no stream that the caller closed, stop a command."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    if sys.stdout is None:  # closed by the caller
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def _exit_with(sentence: str, *, code: int = 2) -> NoReturn:
    from winchcascade.core.plain_text import lines, one_line
    from winchcascade.report.render.terminal import screen_of

    text = one_line(f"winchcascade: {' '.join(sentence.split())}")
    if sys.stderr.isatty():
        import textwrap

        text = textwrap.fill(text, screen_of(sys.stderr).width or len(text), break_on_hyphens=False)
    print(lines(text), file=sys.stderr)
    sys.exit(code)


def _exit_interrupted() -> NoReturn:
    """End by the sentence of an interrupt, where Python has made an exception of it."""
    from winchcascade.core.process_end import remains

    _exit_with(f"interrupted; {remains()}", code=_INTERRUPTED)


def _reject_usage(fault: Exception) -> NoReturn:
    """Report a fault of the input, or of usage as typer found it; any other is one of this
    program and is shown whole.
    """
    from winchcascade.core.errors import WinchcascadeError

    if isinstance(fault, WinchcascadeError):
        _exit_with(str(fault))
    if _was_interrupted(fault):
        _exit_interrupted()
    if not hasattr(fault, "format_message"):
        raise fault
    if not fault.format_message().strip() or type(fault).__name__ == "NoArgsIsHelpError":
        fault.show()  # type: ignore[attr-defined]  # the help of a command that was given nothing
        sys.exit(2)
    sentence = (
        fault.format_message().rstrip(".").replace("not a valid float", "no number such as 4.5")
    )
    sentence = sentence.replace("not a valid int range", "no whole number of the range")
    _exit_with(
        f"{sentence}{'' if sentence.endswith('?') else ';'} --help lists what a command takes."
    )


def _was_interrupted(fault: BaseException | None) -> bool:
    """Whether a fault was made of an interrupt: Python, typer and other libraries wrap one, or
    trip over one, at work.
    """
    while fault is not None:
        if isinstance(fault, KeyboardInterrupt) or type(fault).__name__ == "Abort":
            return True
        fault = fault.__cause__ or fault.__context__
    return False


if __name__ == "__main__":
    main()
