"""What `tailbyte check` found, as plain data (`model`) and as every format somebody reads it in, one file a format."""
