"""The command `clpeel`: the door for a shell."""
