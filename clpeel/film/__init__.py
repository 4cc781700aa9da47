"""Films: pictures of a scene after one another, as one file or as numbered ones."""
