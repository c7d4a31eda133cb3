# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
