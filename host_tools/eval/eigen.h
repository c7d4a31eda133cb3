/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  eigen.h
 * @brief Eigenvalues and eigenvectors of a small symmetric matrix, by Jacobi's rotations.
 */
#ifndef EVL_EIGEN_H
#define EVL_EIGEN_H

#define EVL_EIGEN_MAX 4

/**
 * @param[in,out] m  n x n, row by row, n <= EVL_EIGEN_MAX; destroyed.
 * @param[out] values   Largest first.
 * @param[out] vectors  One per row, unit, in the order of the values.
 */
void evl_eigen_symmetric(double *m, int n, double *values, double *vectors);

#endif
