"""All that the outputs of a task depend on, by hash: values, code, and the declarations of records."""
