/* Labels, part of cells_tmpl.h. Most cells have one appearance, stored by block. In the others segments also end at the
 * next boundary, so that each has one appearance. */

static double within(double x)
{
    return x < 0 ? 0 : x > 1 ? 1 : x;
}

/* The appearance at a lane's position, and the distance to the next boundary; in double precision, so that no boundary
 * is missed. */
OUTLINE void find_edge(March *m, int l)
{
    const TiledJob *const j = m->job;
    Packet *const p = m->p;
    int *const cell = p->owned[l];
    double start[3], from[3], to[3], at = (double)p->at[l], leave = (double)FAR_MM;
    CtsStretch stretch[CTS_CELL_STRETCHES];
    for (int a = 0; a < 3; a++) {
        cell[a] = (int)p->cell[a][l];
        start[a] = m->rays->start_vox[a][p->ray[l]] - cell[a];
        if (j->step[a] != 0)
            leave = fmin(leave, ((int)m->ahead[a] - start[a]) / j->step[a]);
    }
    leave = fmax(leave, at);
    for (int a = 0; a < 3; a++) {
        from[a] = within(start[a] + at * j->step[a]);
        to[a] = within(start[a] + leave * j->step[a]);
    }
    const int n = cts_owner_stretches(j->looks->owners, cell, from, to, stretch);
    int i = 0;
    while (i + 1 < n && stretch[i].end * (leave - at) <= (double)LEAST_MM)
        i++;
    p->look[l] = stretch[i].look;
    p->edge[l] = i + 1 < n && !CTS_MUTATED(EDGES) ? (real)(at + stretch[i].end * (leave - at)) : FAR_MM;
    p->last_look[l] = i + 2 == n ? stretch[i + 1].look : -1;
}

INLINE void find_looks(March *m, vmask lanes)
{
    Packet *const p = m->p;
    const TiledMask *const mask = &m->job->mask;
    const vi block = ((p->cell[2] >> 2) * mask->n[1] + (p->cell[1] >> 2)) * mask->n[0] + (p->cell[0] >> 2);
    const vi look = vi_gather_bytes(m->job->looks->owners->block, block, lanes);
    const vmask alike = lanes & vi_lt(look, vi_of(CTS_LOOKS_DIFFER));
    p->look = vi_select(alike, look, p->look);
    p->edge = vf_select(alike, vf_of(FAR_MM), p->edge);
    for (unsigned left = mask_bits(lanes & ~alike); left; left &= left - 1) {
        const int l = __builtin_ctz(left), *const cell = p->owned[l];
        const bool same = cell[0] == p->cell[0][l] && cell[1] == p->cell[1][l] && cell[2] == p->cell[2][l];
        if (same && p->at[l] >= p->edge[l] && p->last_look[l] >= 0) {
            p->look[l] = p->last_look[l];
            p->edge[l] = FAR_MM;
        } else if (!same || p->at[l] >= p->edge[l]) {
            find_edge(m, l);
        }
    }
}

/* The lanes with the same appearance as the first of them. */
INLINE vmask first_alike(const March *m, unsigned lanes)
{
    const vi look = vi_of(m->p->look[__builtin_ctz(lanes)]);
    return mask_of_bits(lanes) & ~(vi_lt(m->p->look, look) | vi_lt(look, m->p->look));
}
