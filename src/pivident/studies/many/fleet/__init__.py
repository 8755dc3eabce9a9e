"""Many robots, or many days of one: parameters over time, and alarms where one has changed."""
