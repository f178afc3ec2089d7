/* Gauss-Legendre rules on 0..1 that also integrate up to each node, for the attenuation inside a piece. */
#ifndef CTS_RAYCAST_QUADRATURE_H
#define CTS_RAYCAST_QUADRATURE_H

enum { CTS_GAUSS_COARSE = 4, CTS_GAUSS_FINE = 7 };

typedef struct CtsGauss {
    int n;
    double node[CTS_GAUSS_FINE], weight[CTS_GAUSS_FINE];
    /* upto[k][j]: weight of node j in the integral from 0 to node k, exact for polynomials of degree below n. */
    double upto[CTS_GAUSS_FINE][CTS_GAUSS_FINE];
} CtsGauss;

/* n is 1 to CTS_GAUSS_FINE. */
void cts_gauss_init(CtsGauss *rule, int n);

#endif
