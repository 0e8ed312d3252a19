"""All postures of a mechanism with something held: searched, counted, certified."""
