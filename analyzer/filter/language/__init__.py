"""The language of filters: text becomes a tree, or an error under the place that is wrong."""
