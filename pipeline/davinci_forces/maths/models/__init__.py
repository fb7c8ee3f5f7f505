"""Models that are linear in their parameters, for identification and filtering."""
