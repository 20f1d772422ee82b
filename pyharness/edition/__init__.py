"""The edition of the programs as a static web site."""
