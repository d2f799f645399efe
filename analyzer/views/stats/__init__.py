"""Views of statistics: text with bars, JSON, CSV and Arrow."""
