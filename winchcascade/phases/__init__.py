"""Payout, hold and haul-in of every cycle, and the integration windows."""
