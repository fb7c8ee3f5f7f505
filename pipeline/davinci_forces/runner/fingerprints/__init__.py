"""Hashes of all that the outputs of a task depend on: values, code, and the declarations of records."""
