"""Steps of integrations, and what is read from them."""
