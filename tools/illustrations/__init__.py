"""The pictures of the documentation: which command makes each, and how it is made anew."""
