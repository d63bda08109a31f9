# SPDX-License-Identifier: Apache-2.0
"""What an assurer asks, as commands: matrix, policy, bill of materials, mutation, fuzzing."""
