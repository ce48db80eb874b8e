"""One's own scene in three dimensions: what is drawn of a scene, and a page that shows how it moves."""
