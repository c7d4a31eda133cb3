/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Draws all of it. */
head();
cards();
plots();
evaluation();
eventTable();
settingsTable();
Promise.all([beforeAndAfter(), animation(), flight()]).then(() => {
  apply();
  status.resources = performance.getEntriesByType("resource").filter((r) => !r.name.startsWith("data:")).length;
  status.ready = true;
  tell();
}).catch(complain);
