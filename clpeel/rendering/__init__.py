"""Rendering: turns a request into a result, by the stages and a technique."""
