// Who is signed in, with a small menu: signing out, invitations, and for admins the users.

import { get, request } from "../core/api.js";
import { $, element, showNote } from "../core/dom.js";
import { ago } from "../core/format.js";
import { Invitation } from "../setup/invitation.js";
import { endButton, roleSelect } from "../setup/users.js";

export class People {
  list;
  note;

  constructor(session) {
    this.session = session;
    this.invitation = new Invitation();
    this.invitation.place.id = "invitation";
    $("people").after(this.invitation.place);
    $("who").textContent = session.label;
    $("who").title = `${session.role}; sign out${this.isAdmin ? ", users" : ""}`;
    $("who").addEventListener("click", () => this.show($("people").hidden));
    $("invite").hidden = session.role === "viewer";
    $("invite").addEventListener("click", () => this.invite("viewer"));
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.show(false);
    });
  }

  get isAdmin() {
    return this.session.role === "admin";
  }

  show(open) {
    $("people").hidden = !open;
    $("who").setAttribute("aria-expanded", String(open));
    if (!open) return;
    const { label, role, account } = this.session;
    const actions = element(
      "div",
      { className: "actions" },
      element("button", { id: "sign-out", onclick: () => this.signOut(false) }, "Sign out"),
    );
    if (account)
      actions.append(
        element(
          "button",
          { onclick: () => this.signOut(true), title: "in all browsers" },
          "Sign out everywhere",
        ),
      );
    if (this.isAdmin)
      actions.append(
        element(
          "button",
          { id: "invite-operator", onclick: () => this.invite("operator") },
          "Invite an operator",
        ),
      );
    const told = account ? role : `${role}, by a link`;
    this.note = element("p", { className: "note", hidden: true });
    this.list = element("div", { id: "users" });
    $("people").replaceChildren(
      element("p", {}, element("b", {}, label), ` ${told}`),
      actions,
      this.note,
      this.list,
    );
    if (this.isAdmin) this.attempt(() => this.refresh());
  }

  async refresh() {
    const users = await get("/api/users");
    this.list.replaceChildren(...users.map((user) => this.row(user)));
  }

  row(user) {
    const { name, role, account, last_seen: stamp } = user,
      act = (ask) => this.attempt(ask, true);
    return element(
      "div",
      { className: "user" },
      element("span", { className: "name", title: account ? "" : "signed in by a link" }, name),
      account ? roleSelect(user, act) : element("span", { className: "dim" }, role),
      element("span", { className: "dim" }, ago(stamp)),
      endButton(user, act, "End sessions"),
    );
  }

  async attempt(action, refresh = false) {
    try {
      await action();
    } catch (error) {
      this.tell(error.message);
    }
    if (refresh) await this.refresh().catch(() => undefined); // one's own session may be among the ended
  }

  async signOut(everywhere) {
    await this.attempt(() => request("POST", "/api/session/sign_out", { everywhere }));
    location.assign("/login");
  }

  tell(text) {
    if ($("people").hidden) return;
    showNote(this.note, text);
  }

  invite(role) {
    this.show(false); // it would lie below
    this.invitation.show(role);
  }
}
