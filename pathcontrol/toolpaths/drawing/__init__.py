"""The common part of drawings: pieces, their chains, and the choice of what is left out."""
