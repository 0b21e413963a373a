/* Sizes, and small dense matrices, row by row. */

enum {
    NX = 2 * JOINTS,   /* state */
    NU = JOINTS,       /* torque */
    NZ = NX + 1,       /* state and T */
    NV = NX + 1 + NU,  /* state, T and torque of an interval: (x, T, u) */
    NY = NV + NX,      /* unknowns of an interval */
    BLOCK = NX + NU    /* from one knot to the next */
};

/* fmax and fmin without a library call; the first number if the second is NaN. */
static inline double larger(double a, double b) { return b > a ? b : a; }
static inline double smaller(double a, double b) { return b < a ? b : a; }

/* For calls with constant sizes, whose loops the compiler unrolls. */
#define INLINE static inline __attribute__((always_inline))

/* LU factorization with partial pivoting; 0: singular. */
static int lu_factor(double A[NX][NX], int *pivot) {
    for (int j = 0; j < NX; j++) {
        int best = j;
        for (int i = j + 1; i < NX; i++)
            if (fabs(A[i][j]) > fabs(A[best][j])) best = i;
        pivot[j] = best;
        if (!(fabs(A[best][j]) > 1e-12)) return 0;
        if (best != j)
            for (int l = 0; l < NX; l++) {
                double swap = A[j][l];
                A[j][l] = A[best][l], A[best][l] = swap;
            }
        double inverse = 1 / A[j][j];
        for (int i = j + 1; i < NX; i++) {
            double factor = A[i][j] *= inverse;
            for (int l = j + 1; l < NX; l++) A[i][l] -= factor * A[j][l];
        }
    }
    return 1;
}

/* Solve A X = B in place, B of `columns` columns. */
INLINE void lu_solve(double LU[NX][NX], const int *pivot, double *restrict B, int columns) {
    for (int j = 0; j < NX; j++)
        if (pivot[j] != j)
            for (int l = 0; l < columns; l++) {
                double swap = B[j * columns + l];
                B[j * columns + l] = B[pivot[j] * columns + l], B[pivot[j] * columns + l] = swap;
            }
    for (int j = 0; j < NX; j++)
        for (int i = j + 1; i < NX; i++)
            for (int l = 0; l < columns; l++) B[i * columns + l] -= LU[i][j] * B[j * columns + l];
    for (int j = NX - 1; j >= 0; j--) {
        double inverse = 1 / LU[j][j];
        for (int l = 0; l < columns; l++) B[j * columns + l] *= inverse;
        for (int i = 0; i < j; i++)
            for (int l = 0; l < columns; l++) B[i * columns + l] -= LU[i][j] * B[j * columns + l];
    }
}

/* Solve A' x = b in place. */
static void lu_transposed(double LU[NX][NX], const int *pivot, double *b) {
    for (int j = 0; j < NX; j++) {
        for (int i = 0; i < j; i++) b[j] -= LU[i][j] * b[i];
        b[j] /= LU[j][j];
    }
    for (int j = NX - 1; j >= 0; j--)
        for (int i = j + 1; i < NX; i++) b[j] -= LU[i][j] * b[i];
    for (int j = NX - 1; j >= 0; j--)
        if (pivot[j] != j) {
            double swap = b[j];
            b[j] = b[pivot[j]], b[pivot[j]] = swap;
        }
}

/* Cholesky factorization A = LL'; 0: not positive definite. */
INLINE int cholesky(double *A, int n) {
    for (int j = 0; j < n; j++) {
        double pivot = A[j * n + j], scale = fabs(pivot);
        for (int l = 0; l < j; l++) pivot -= A[j * n + l] * A[j * n + l];
        if (!(pivot > 1e-13 * scale)) return 0;
        A[j * n + j] = pivot = sqrt(pivot);
        for (int i = j + 1; i < n; i++) {
            double sum = A[i * n + j];
            for (int l = 0; l < j; l++) sum -= A[i * n + l] * A[j * n + l];
            A[i * n + j] = sum / pivot;
        }
    }
    return 1;
}

/* Solve L X = B in place. */
INLINE void forward(const double *L, int n, double *restrict B, int columns) {
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++)
            for (int l = 0; l < columns; l++) B[i * columns + l] -= L[i * n + j] * B[j * columns + l];
        double inverse = 1 / L[i * n + i];
        for (int l = 0; l < columns; l++) B[i * columns + l] *= inverse;
    }
}

/* Solve L' x = b in place. */
INLINE void backward(const double *L, int n, double *b) {
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) b[i] -= L[j * n + i] * b[j];
        b[i] /= L[i * n + i];
    }
}
