"""Which test to run next: what a posterior is to answer, and what further tests would bring."""
