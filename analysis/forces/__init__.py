"""Forces: statics, dynamics, transmissions and start states of mechanisms with loops."""
