"""The sections of reports; each is a pure function of a result."""
