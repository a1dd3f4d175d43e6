"""The command ``cwlf-slam``: one module a command. The room alone reads arguments and exits."""
