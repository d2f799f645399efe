"""The vehicle's body: motors with their propellers, the battery they share, and the airframe they carry."""
