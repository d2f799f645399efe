"""Pages before the panes: what keys mean, what a rule is about, what can be done here."""
