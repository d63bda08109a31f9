"""Puts this folder on the import path, so that tests in every room can share its helpers."""
