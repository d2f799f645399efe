"""Conformance: rules over the tables of a capture, from single breaches to findings and verdicts.

Here is the engine. The rules stand in packages by the layer that their codes name: `frames` (CAN), `transfers` (TRF),
`values` (TYP), `bus` (BUS), `capture` (CAP). There is no package for PUSH: a vendor's packets are known to nobody but
its dissector, so these rules are all in the vendor's folder, such as `dissectors/tmotor/rules`.
"""
