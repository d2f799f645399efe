"""Pages for a browser and a recording for viewers, served by Rerun's own program behind a gate."""
