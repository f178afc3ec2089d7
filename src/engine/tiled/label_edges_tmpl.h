/* Labels, part of tiled_march_tmpl.h. Most cells have one appearance, stored by block. In the others segments also end
 * at the next boundary, so that each has one appearance. */

/* The appearance at a lane's position, and the distance to the next boundary; in double precision, so that no boundary
 * is missed. */
OUTLINE void find_edge(March *m, int l)
{
    const TiledJob *const j = m->job;
    Packet *const p = m->p;
    int *const cell = p->label_cell[l];
    double start[3], from[3], to[3], at = (double)p->t[l], leave = (double)FAR_MM;
    CtsLineInterval interval[CTS_MAX_CELL_INTERVALS];
    for (int a = 0; a < 3; a++) {
        cell[a] = (int)p->cell[a][l];
        start[a] = m->rays->start_vox[a][p->ray[l]] - cell[a];
        if (j->step[a] != 0)
            leave = fmin(leave, ((int)m->ahead[a] - start[a]) / j->step[a]);
    }
    leave = fmax(leave, at);
    for (int a = 0; a < 3; a++) {
        from[a] = cts_clamp01(start[a] + at * j->step[a]);
        to[a] = cts_clamp01(start[a] + leave * j->step[a]);
    }
    const int n = cts_label_intervals(j->appearances->voxel_labels, cell, from, to, interval);
    int i = 0;
    while (i + 1 < n && interval[i].end * (leave - at) <= (double)MIN_MM)
        i++;
    p->appearance[l] = interval[i].appearance;
    p->t_label_edge[l] = i + 1 < n && !CTS_MUTATED(EDGES) ? (real)(at + interval[i].end * (leave - at)) : FAR_MM;
    p->last_appearance[l] = i + 2 == n ? interval[i + 1].appearance : -1;
}

INLINE void find_appearances(March *m, vmask lanes)
{
    Packet *const p = m->p;
    const TiledMask *const mask = &m->job->mask;
    const vi block = ((p->cell[2] >> 2) * mask->n[1] + (p->cell[1] >> 2)) * mask->n[0] + (p->cell[0] >> 2);
    const vi appearance = vi_gather_bytes(m->job->appearances->voxel_labels->block, block, lanes);
    const vmask alike = lanes & vi_lt(appearance, vi_of(CTS_APPEARANCES_DIFFER));
    p->appearance = vi_select(alike, appearance, p->appearance);
    p->t_label_edge = vf_select(alike, vf_of(FAR_MM), p->t_label_edge);
    for (unsigned left = mask_bits(lanes & ~alike); left; left &= left - 1) {
        const int l = __builtin_ctz(left), *const cell = p->label_cell[l];
        const bool same = cell[0] == p->cell[0][l] && cell[1] == p->cell[1][l] && cell[2] == p->cell[2][l];
        if (same && p->t[l] >= p->t_label_edge[l] && p->last_appearance[l] >= 0) {
            p->appearance[l] = p->last_appearance[l];
            p->t_label_edge[l] = FAR_MM;
        } else if (!same || p->t[l] >= p->t_label_edge[l]) {
            find_edge(m, l);
        }
    }
}

/* The lanes with the same appearance as the first of them. */
INLINE vmask same_appearance_as_first(const March *m, unsigned lanes)
{
    const vi appearance = vi_of(m->p->appearance[__builtin_ctz(lanes)]);
    return mask_of_bits(lanes) & ~(vi_lt(m->p->appearance, appearance) | vi_lt(appearance, m->p->appearance));
}
