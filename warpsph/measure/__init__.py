"""Numbers read off a state or a record: energy, gauges, waves."""
