"""The statements of the thesis about results, judged."""
