# SPDX-License-Identifier: Apache-2.0
"""The one version string; `setup.py`, the docs and `package.xml` follow it."""

__version__ = "0.1.0"
