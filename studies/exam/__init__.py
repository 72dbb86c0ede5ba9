"""The public exam: cases with planted truth or real logs, a contract for tools, and a scorer."""
