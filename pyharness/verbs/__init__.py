"""One module for each verb: it declares its options and runs; the exit code is what it returns."""
