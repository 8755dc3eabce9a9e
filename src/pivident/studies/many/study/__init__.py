"""Many simulated runs with known truth: are the estimates right, and the intervals true?"""
