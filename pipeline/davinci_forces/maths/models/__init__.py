"""Models that are linear in their parameters, as identification and filtering take them."""
