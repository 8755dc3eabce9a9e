"""Should one believe it: tests, essential parameters, cross-validation, model error."""
