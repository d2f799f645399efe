"""Display filters at work: on the batches of a run, on its frames, on its findings."""
