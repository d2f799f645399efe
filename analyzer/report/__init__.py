"""The findings of `tailbyte check` as plain data (`model`) and as every format somebody reads, one file a format."""
