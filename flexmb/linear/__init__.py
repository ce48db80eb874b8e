"""Linear models: exact derivatives about a state, equilibria, steady spins, modes, Campbell diagrams."""
