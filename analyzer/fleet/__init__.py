"""Fleets: many captures judged by a cluster, their results as tables in one store, and reports over them."""
