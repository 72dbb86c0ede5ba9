"""How far intervals and verdicts can be trusted on this robot and motion."""
