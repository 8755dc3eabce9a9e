"""The faces of pivident: command line, studio, notebook."""
