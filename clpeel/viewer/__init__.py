"""The viewer: a scene in a window, a browser or a notebook, on rendercanvas."""
