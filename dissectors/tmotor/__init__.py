"""T-Motor: TM-UAVCAN V2.2 as data, and a vehicle that speaks it."""
