# SPDX-License-Identifier: Apache-2.0
"""The report of speed against error; see __main__.py."""
