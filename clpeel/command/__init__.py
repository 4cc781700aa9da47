"""The command `clpeel`: clpeel for the shell."""
