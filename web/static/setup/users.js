// Who may use this station: an admin manages accounts; all others see who is signed in.

import { get, request } from "../core/api.js";
import { element, optionsOf, showNote, tableHead } from "../core/dom.js";
import { Invitation } from "./invitation.js";
import { ago } from "../core/format.js";

const ROLES = ["viewer", "operator", "admin"];
const PERIOD = 10_000; // ms

const pathOf = (name) => `/api/users/${encodeURIComponent(name)}`;

// The choice of a user's role; act(request, said) sends it.
export const roleSelect = ({ name, role }, act) =>
  element(
    "select",
    {
      ariaLabel: `role of ${name}`,
      title: "changing the role signs the user out",
      onchange: ({ target }) =>
        act(
          () => request("PUT", `${pathOf(name)}/role`, { role: target.value }),
          `${name} is now ${target.value}`,
        ),
    },
    ...optionsOf(ROLES, role),
  );

export const endButton = ({ name, sessions }, act, text) =>
  element(
    "button",
    {
      disabled: !sessions,
      title: "sign this user out everywhere now",
      ariaLabel: `${text}: ${name}`,
      onclick: () => act(() => request("POST", `${pathOf(name)}/end_sessions`), `${name} is signed out`),
    },
    text,
  );

export class UserSection {
  newRole;

  constructor(place, session) {
    this.session = session;
    this.isAdmin = session.role === "admin";
    this.body = element("tbody");
    this.note = element("p", { className: "note", role: "status", hidden: true });
    const columns = ["name", "role", "signed in", "last seen", ...(this.isAdmin ? [""] : [])];
    place.append(element("table", { className: "list" }, tableHead(...columns), this.body), this.note);
    if (this.isAdmin) place.append(this.form(), this.invitations());
    else place.append(element("p", { className: "hint" }, "Users are added and changed by admins."));
    this.refresh();
    this.timer = setInterval(() => {
      if (!this.body.contains(document.activeElement)) this.refresh();
    }, PERIOD);
  }

  async refresh() {
    try {
      const users = await get(this.isAdmin ? "/api/users" : "/api/setup/people");
      this.body.replaceChildren(...users.map((user) => this.row(user)));
      if (this.isAdmin) this.offerRole(users.some(({ account }) => account));
    } catch (error) {
      this.tell(error.message);
    }
  }

  row(user) {
    const { name, role, account, sessions, last_seen } = user,
      act = (ask, said) => this.act(ask, said);
    const mine = name === this.session.label ? " (you)" : "";
    const cells = [
      element("b", {}, name, element("small", {}, `${mine}${account ? "" : " by a link"}`)),
      account && this.isAdmin ? roleSelect(user, act) : role,
      String(sessions),
      ago(last_seen),
    ];
    const acts = [];
    if (this.isAdmin) {
      acts.push(endButton(user, act, "Sign out"));
      if (account) acts.push(this.remove(name));
    }
    return element(
      "tr",
      {},
      ...cells.map((cell) => element("td", {}, cell)),
      ...(this.isAdmin ? [element("td", { className: "acts" }, ...acts)] : []),
    );
  }

  // The first press asks, the second does: a slip costs an account otherwise.
  remove(name) {
    const button = element("button", { ariaLabel: `delete ${name}` }, "Delete");
    const calm = () => {
      button.textContent = "Delete";
      button.classList.remove("caution");
      button.ariaLabel = `delete ${name}`;
    };
    button.addEventListener("blur", calm);
    button.addEventListener("click", () => {
      if (button.classList.contains("caution")) {
        button.blur();
        this.act(() => request("DELETE", pathOf(name)), `${name} is deleted`);
        return;
      }
      button.textContent = "Really delete";
      button.ariaLabel = `really delete ${name}`;
      button.classList.add("caution");
    });
    return button;
  }

  form() {
    const name = element("input", {
      name: "name",
      required: true,
      maxLength: 32,
      pattern: "[a-z][a-z0-9_.\\-]*",
      title: "lower-case letters, digits and _ . -, beginning with a letter",
      autocomplete: "off",
      spellcheck: false,
    });
    const password = element("input", {
      name: "password",
      type: "password",
      required: true,
      minLength: 10,
      maxLength: 1000,
      title: "ten characters or more",
      autocomplete: "new-password",
    });
    const role = (this.newRole = element(
      "select",
      { name: "role", disabled: true },
      ...optionsOf(ROLES, "operator"),
    ));
    const labelled = (label, input) => element("label", {}, element("span", {}, label), input);
    const form = element(
      "form",
      { className: "add" },
      element("h3", {}, "Add a user"),
      labelled("Name", name),
      labelled("Password", password),
      labelled("Role", role),
      element("button", {}, "Add"),
    );
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      const wanted = {
        name: name.value,
        password: password.value,
        ...(role.disabled ? {} : { role: role.value }),
      };
      password.value = "";
      let made;
      const done = await this.act(
        async () => {
          made = await request("POST", "/api/users", wanted);
        },
        () => `${made.name} was added as ${made.role}`,
      );
      if (done && name.value === wanted.name) name.value = ""; // unless the next one is being typed
    });
    return form;
  }

  // The first account is an admin's, else nobody could manage the others. Until it is known
  // whether there are any, the station chooses: of accounts after the first, operator.
  offerRole(hasAccounts) {
    if (hasAccounts && !this.newRole.disabled) return; // somebody may have chosen one
    this.newRole.disabled = !hasAccounts;
    this.newRole.value = hasAccounts ? "operator" : "admin";
    this.newRole.title = hasAccounts ? "" : "the first account becomes an admin";
  }

  invitations() {
    const invitation = new Invitation(),
      button = (text, role) => element("button", { onclick: () => invitation.show(role) }, text);
    return element(
      "div",
      { className: "add" },
      element("h3", {}, "Or a one-time link, without a password"),
      button("For a viewer", "viewer"),
      button("For an operator", "operator"),
      invitation.place,
    );
  }

  // Whether it went well; `said`, a text or what makes it, is told once the list shows it.
  async act(action, said) {
    let problem = "";
    try {
      await action();
    } catch (error) {
      problem = error.message;
    }
    await this.refresh();
    this.tell(problem || (typeof said === "function" ? said() : said), !problem);
    return !problem;
  }

  tell(text, good = false) {
    this.note.classList.toggle("good", good);
    showNote(this.note, text);
  }
}
