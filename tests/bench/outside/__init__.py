"""A campaign whose faults and expectations owe nothing to the rules: see `__main__`."""
