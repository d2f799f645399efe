"""A page of Markdown as text for a terminal: its blocks, its tables, its words in lines."""
