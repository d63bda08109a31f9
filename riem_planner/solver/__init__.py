"""The solver: descent on the discretised cost, then multiple shooting on its extremal."""
