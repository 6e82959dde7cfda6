"""What is driven, on which tire, with which effects planted: the scenario file."""
