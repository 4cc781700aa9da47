"""Rendering: a request to a result, by the stages and a technique."""
