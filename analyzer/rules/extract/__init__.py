"""The smallest capture that still shows a finding."""
