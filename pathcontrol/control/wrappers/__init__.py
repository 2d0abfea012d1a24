"""Laws around another law, which choose the speed along its path, and the rules that they follow."""
