"""What is passed around: the setup of a log and the log itself as frozen values in SI."""
