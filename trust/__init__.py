"""What an assurer asks, as commands: matrix, policy, bill of materials, mutation, fuzzing."""
