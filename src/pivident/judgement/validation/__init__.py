"""Tests of residuals and instruments, prediction of held-out motion."""
