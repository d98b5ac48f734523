"""Estimation: records as a problem, hypotheses, and their fits on windows."""
